// Part of every test program that runs under AddressSanitizer: what LeakSanitizer is told.

extern "C" {
// NOLINTBEGIN: the names that it looks for
const char* __lsan_default_suppressions();
const char* __lsan_default_options();
// NOLINTEND
}

// Strangers read our files. lib3mf leaves some of libzip's sources to nobody, and ITK's NrrdIO does
// not free what it has read of a header that it refuses.
const char* __lsan_default_suppressions() { return "leak:libzip.so\nleak:libITKNrrdIO\n"; }
const char* __lsan_default_options() { return "print_suppressions=0"; }
