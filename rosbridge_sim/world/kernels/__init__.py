"""The decisions and the motion of drivers on lanes as loops in C, which give the bits of the arrays."""
