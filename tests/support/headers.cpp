// This library exists only for the precompiled header that test programs share.
