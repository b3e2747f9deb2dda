"""CiA 402 drives on a CAN bus: export a motion, stream it, simulate the drive that follows."""
