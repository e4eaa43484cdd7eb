"""Identify one tag by light: which spot, the shot, the verdict. Time comes in with replies."""
