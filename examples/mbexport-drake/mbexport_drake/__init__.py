"""A backend for mbexport: SDF, run by Drake."""
