// Compiled once for the precompiled headers that most libraries share.
