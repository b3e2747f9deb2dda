"""CiA 402 drives on a CAN bus: export a motion, stream it, simulate the drive that follows.

Here is what all of that shares: objects, frames, scaling, and what a drive must be set to.
"""

import logging

# python-can says of every driver that is not there that it is not there, and canopen of a missing answer what
# reaches people as a sentence
for _name in ("can", "seeedbus", "canopen"):
    logging.getLogger(_name).addHandler(logging.NullHandler())
