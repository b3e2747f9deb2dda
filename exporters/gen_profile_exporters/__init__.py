"""Write a motion in the forms controllers take, and read back what each of them will issue."""
