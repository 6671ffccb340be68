"""The application: command line, window, panel, camera control and background work."""
