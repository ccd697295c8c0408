// The precompiled header of most libraries belongs to this source.
