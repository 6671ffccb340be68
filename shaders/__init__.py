"""GLSL sources, one file a stage; functions that several share lie in include/."""
