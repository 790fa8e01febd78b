"""mbexport core."""
