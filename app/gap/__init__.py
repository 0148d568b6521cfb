"""The gap diagnosis for people: what is given, the diagnosis, what comes out."""
