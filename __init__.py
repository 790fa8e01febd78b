"""mbexport: one robot database, every simulator, one answer."""
