"""The quickest motions that a machine and a promise allow, whatever controller makes them."""
