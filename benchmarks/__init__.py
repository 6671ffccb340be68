"""Run time against error: the reference picture, the measures and the baselines beside them."""
