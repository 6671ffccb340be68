"""The headless core: from a file to surfels, hierarchy, cones, tiles and the cut. Knows no GL."""
