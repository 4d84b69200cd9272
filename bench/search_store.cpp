// How long a store's level takes to be searched for active tiles, by its block
// ranges and by each index that it has: bench_search_store STORE ISOVALUE…
//
// "warm" is the best of many searches, "cold" the median of some for which the
// files were dropped from the page cache.
// Built as in bench/README.md.

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <isobrick/error.h>
#include "bricks/stored_index.h"
#include "stream/tile_stream.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// Takes what lies below isobrick/ out of the page cache; it is clean.
void drop_pages(const fs::path& store) {
  for (const auto& entry : fs::recursive_directory_iterator(store / "isobrick")) {
    if (!entry.is_regular_file()) continue;
    const int fd = ::open(entry.path().c_str(), O_RDONLY | O_CLOEXEC);
    if (fd < 0) continue;
    ::posix_fadvise(fd, 0, 0, POSIX_FADV_DONTNEED);
    ::close(fd);
  }
}

struct Search {
  std::size_t tiles = 0;
  std::uint64_t bytes = 0;
  double seconds = 0;
};

Search search(const StoreReader& store, double isovalue, SearchMethod by) {
  const auto start = std::chrono::steady_clock::now();
  TileStream stream(store, 0, isovalue, store.info().levels[0].lattice.box(), by);
  Search result;
  while (stream.next()) ++result.tiles;
  result.bytes = stream.range_bytes() + stream.index_bytes();
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

void measure(const fs::path& path, const StoreReader& store, double isovalue, SearchMethod by) {
  Search result = search(store, isovalue, by);
  double warm = result.seconds;
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < 200 && std::chrono::steady_clock::now() - begin < std::chrono::seconds(1);
       ++i)
    warm = std::min(warm, search(store, isovalue, by).seconds);
  std::vector<double> cold;
  for (int i = 0; i < 7; ++i) {
    drop_pages(path);
    cold.push_back(search(store, isovalue, by).seconds);
  }
  std::sort(cold.begin(), cold.end());
  const std::string kind = by.kind ? std::string(name_of(*by.kind)) : "none";
  const long leaf = by.kind ? StoredIndex(store, 0, kind).layout().leaf : 16;
  const std::string name = (by.only_if_few ? "if few: " : "") + kind;
  std::printf("%-17s %4ld %9g %8zu %11llu %10.3f %10.3f\n", name.c_str(), leaf, isovalue,
              result.tiles, static_cast<unsigned long long>(result.bytes), 1e3 * warm,
              1e3 * cold[cold.size() / 2]);
}

int run(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: bench_search_store STORE ISOVALUE...\n");
    return 2;
  }
  const StoreReader store(argv[1]);
  std::printf("index             leaf  isovalue    tiles       bytes    warm ms    cold ms\n");
  for (int i = 2; i < argc; ++i) {
    const double isovalue = std::atof(argv[i]);
    measure(argv[1], store, isovalue, {});
    for (const std::string& kind : stored_index_kinds(store, 0))
      for (const bool only_if_few : {false, true})
        measure(argv[1], store, isovalue, {parse_index_kind(kind), only_if_few});
  }
  return 0;
}

}  // namespace
}  // namespace isobrick

int main(int argc, char** argv) {
  try {
    return isobrick::run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
