// The precompiled headers of most libraries belong to this source.
