"""The splatting renderer: draws a cut into a window, an offscreen target or arrays. Knows no window."""
