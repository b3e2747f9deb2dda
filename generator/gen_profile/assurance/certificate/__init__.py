"""A proof that no machine of a box sways by more than a bound, and the file that holds it."""
