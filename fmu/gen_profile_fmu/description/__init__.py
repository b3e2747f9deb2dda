"""The files of an FMU and of a system of FMUs, as FMI 2, FMI 3 and SSP want them."""
