"""Settings and state of models, buffers and archives: one file format and one check for all."""
