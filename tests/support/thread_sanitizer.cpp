// Linked into every test program under ThreadSanitizer.

// Debian's libcpp-httplib is not instrumented: ThreadSanitizer sees the copies of its threads, but
// not the initialisation of a function's static variable (its set of methods) before their reads.
// OpenSSL 3.5 (Debian 13) is not either, and synchronises its tables with locks of its own. Reports
// on these libraries' own memory are suppressed, those on our handlers are not.
extern "C" const char* __tsan_default_suppressions();  // NOLINT: the name that it looks for

const char* __tsan_default_suppressions() {
  return "called_from_lib:libcpp-httplib.so\ncalled_from_lib:libcrypto.so\n";
}
