"""CiA 402 drives on a CAN bus: export a motion, stream it, simulate the drive that follows.

Here is what all of that shares: objects, frames, scaling, and what a drive must be set to.
"""
