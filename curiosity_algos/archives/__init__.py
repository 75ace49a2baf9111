"""Archives of elites behind pyribs' interface, their files, and checks that elites reproduce."""
