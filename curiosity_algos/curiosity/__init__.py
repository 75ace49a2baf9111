"""The one owner of curiosity: a bonus, its training and its scale, whoever pays it."""
