"""How vendors' axes are powered, taken and guided: their libraries' calls, for wrappers around our blocks.

Each library is a file of macros, which ends in ``n`` what is an axis's own, and tells

- ``axis_type``, empty where the axis is inputs and outputs, and ``guide``, the block that guides the axis;
- ``inputs``, ``outputs``, ``instances``: what an axis adds to the wrapper, with or without what powers it;
- ``setpoint``, ``speed``, ``actual``, ``homed``: where the axis is commanded to be, at which velocity, where
  it is, and whether that is known;
- ``power``: powers the axis while ``bOn`` is set and resets it with ``bAcknowledge``; sets ``bResets`` as
  long as that takes;
- ``prepare``, before the block is called: tells by ``nCause`` what is wrong with the axis, and clears
  ``bReady`` as long as it is not guided;
- ``feed``, after it was called: gives ``fPosition``, ``fVelocity`` and ``fAcceleration`` to the axis if
  ``bFeed``, and tells by ``nCause`` what went wrong.

The calls follow the vendors' public manuals; they were not tried on a controller.
"""

TWINCAT, CODESYS, SIEMENS = "libraries/twincat.st", "libraries/codesys.st", "libraries/siemens.st"
VELOCITY = "libraries/velocity.st"  # velocity setpoints, with a position control of our own
# Whose positions of a modulo axis are known: NC axes count on through all turns (Beckhoff, Tc2_MC2, notes on
# modulo positioning), and of our own position control the wrapper itself decides.
OF_MODULO_AXES = (TWINCAT, VELOCITY)
