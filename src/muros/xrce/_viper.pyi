from muros.xrce._codec import crc16 as crc16
from muros.xrce._codec import stuff as stuff
from muros.xrce._codec import unstuff as unstuff

NATIVE: bool
