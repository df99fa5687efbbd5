"""rclc as hosts have it: checks of what is asked for, errors that say more, threads, asyncio, files, the graph.

Boards have no room for this. What both have in common is in the folder above; the classes here are subclasses of those
there, and ``muros.rclc`` gives a program the ones that fit where it runs.

==================================================================  ===========================================
``context`` ``entities`` ``handles`` ``executor``                   what programs make, with checks
``let`` ``outlet`` ``awaiting`` ``waiting``                         logical execution time for threads; asyncio
``groups`` ``sharing`` ``workers``                                    executors in threads of their own
``sense_plan_act``                                                  stages with barriers
``remapping`` ``parameters`` ``parameter_files`` ``logger``         arguments, parameters and levels of ROS 2
``graph`` ``endpoints`` ``agent_graph``                             who is there, and what an agent tells of it
``events`` ``agent_events``                                         what becomes of publishers and subscriptions
``clock`` ``expiry`` ``memory`` ``actions`` ``checks``              the rest, each by its name
``middleware``                                                      further ways into a graph
==================================================================  ===========================================
"""
