"""What goes into an FMU, whatever FMI's version: variables, equations in C, words."""
