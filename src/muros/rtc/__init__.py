"""RT components, compatible with OpenRTM-aist: written in Python, run after one ``pip install 'muros[rtc]'``.

The folders are the architecture. What is in this folder is the model: components, their state machine, ports,
configuration sets, as plain Python objects that know nothing of CORBA. Around it stand

- ``contexts``: execution contexts, which call components; their pass over the components takes no clock,
- ``data``: buffers, publishers, data ports and what carries their octets,
- ``services``: service ports,
- ``corba``: the model as the RTC world sees it: stubs, servants, references, the name service,
- ``manager``: what makes components, names them and ends them, after ``rtc.conf``.

docs/how-rtc-works.md draws the way of a value through them.
"""
