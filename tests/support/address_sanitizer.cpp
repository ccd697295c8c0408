// Linked into every test program under AddressSanitizer: options of LeakSanitizer.

extern "C" {
// NOLINTBEGIN: the names that it looks for
const char* __lsan_default_suppressions();
const char* __lsan_default_options();
// NOLINTEND
}

// Leaks of libraries with untrusted files: lib3mf leaks some of libzip's sources, and ITK's NrrdIO
// leaks rejected headers.
const char* __lsan_default_suppressions() { return "leak:libzip.so\nleak:libITKNrrdIO\n"; }
const char* __lsan_default_options() { return "print_suppressions=0"; }
