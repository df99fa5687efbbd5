"""The DDS-XRCE protocol (OMG formal/20-02-01) without I/O: one implementation for clients and agents.

Bytes, events and the time come in as arguments; messages go out through a function that was handed in. Nothing
here opens a socket, reads a clock, starts a thread or logs. Boards import only the modules they use, so this
package gathers no names:

====================  =========  =======================================================================
module                runs on    holds
====================  =========  =======================================================================
``constants``         hosts      the wire constants of the specification, by name
``streams``           both       best-effort and reliable streams, as long as no message is lost
``outputs``           both       streams as sender: made, asked
``inputs``            both       streams as receiver: made, begun again
``mending``           both       what is done about messages that come early or not at all
``queues``            hosts      streams of hosts with many sessions
``fragments``         both       joining and cutting samples that are larger than a message
``session``           both       a session: headers, streams, acknowledgements; either role
``beginning``         both       a session when it is made
``resetting``         both       streams that begin again
``requests``          both       submessages with ids
``create``            both       CREATE and READ_DATA payloads, as a client writes them
``entities``          hosts      what a client asks for, as values
``representation``    hosts      the same payloads, as an agent reads them from foreign bytes
``serial``            both       frames of serial lines, with escaping and CRC-16/ARC
``framing``           hosts      the frames of every stream-like link: serial, TCP, CAN FD
====================  =========  =======================================================================
"""
