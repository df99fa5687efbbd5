"""The DDSI-RTPS 2.3 protocol without I/O: messages, discovery data, writers and readers."""
