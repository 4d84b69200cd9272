// Part of every test program under AddressSanitizer.

extern "C" {

/// libhdf5 requests as much memory as a damaged file states, and copes with getting none.
const char* __asan_default_options() { return "allocator_may_return_null=1"; }

/// Nothing is unloaded, so that what a driver has kept is reported with its name.
int dlclose(void*) { return 0; }

/// DCMTK and libhdf5 keep lists of codecs and of free blocks until the program ends. Where a
/// tree is damaged, OpenVDB forgets the node that it was reading.
const char* __lsan_default_suppressions() {
  return "leak:libdcmdata\nleak:libhdf5\nleak:libopenvdb\nleak:readTopology\n";
}

}  // extern "C"
