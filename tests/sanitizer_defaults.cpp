// Part of every test program under AddressSanitizer.

extern "C" {

/// libhdf5 asks for as much memory as a damaged file says, and copes with getting none.
const char* __asan_default_options() { return "allocator_may_return_null=1"; }

/// Lists of codecs and of free blocks, which these libraries keep until the program ends.
const char* __lsan_default_suppressions() { return "leak:libdcmdata\nleak:libhdf5\n"; }

}  // extern "C"
