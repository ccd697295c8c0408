// Nothing but the precompiled header that test programs share is wanted of this library.
