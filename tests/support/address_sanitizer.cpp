// What LeakSanitizer is told in every test program.

// lib3mf, which reads our files as a stranger does, leaves some of libzip's sources to nobody.
extern "C" const char* __lsan_default_suppressions();  // NOLINT: the name that it looks for

const char* __lsan_default_suppressions() { return "leak:libzip.so\n"; }
