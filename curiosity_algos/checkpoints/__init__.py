"""Files of models, archives and their parts: written whole, read without running code."""
