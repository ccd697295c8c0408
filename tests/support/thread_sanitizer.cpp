// Part of every test program that runs under ThreadSanitizer.

// Debian's libcpp-httplib is not instrumented: ThreadSanitizer sees what its threads copy, but not
// that a function's static variable (the set of methods that it knows) was made before anybody
// reads it. OpenSSL 3.5, of Debian 13, is not either, and hands its tables on by locks of its own.
// What these libraries do with memory of their own is not judged; what our handlers do is.
extern "C" const char* __tsan_default_suppressions();  // NOLINT: the name that it looks for

const char* __tsan_default_suppressions() {
  return "called_from_lib:libcpp-httplib.so\ncalled_from_lib:libcrypto.so\n";
}
