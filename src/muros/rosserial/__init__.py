"""rosserial, compatible with ros_lib boards of every release: the protocol, a client, and a server for the data space.

Boards import only the modules they use, so this package gathers no names:

====================  =========  =======================================================================
module                runs on    holds
====================  =========  =======================================================================
``constants``         hosts      the numbers of the protocol, by name
``packets``           both       frames of both protocol versions: made, and found in a stream of bytes
``messages``          both       what the protocol itself sends: topics, parameters, logs, time
``device``            both       the board's side of a session: bytes in, bytes out
``node_handle``       both       what a board's program uses: NodeHandle
``serial`` ``tcp``    both       lines for it; ``uart`` on boards
``fields``            both       what generated ROS 1 message classes call
``types``             hosts      ROS 1 message classes, made at run time or written for boards
``server``            hosts      the server: boards on one side, the space on the other
====================  =========  =======================================================================

docs/protocol/rosserial.md describes the protocol, docs/rosserial.md how to connect a board.
"""
