// cancel: another thread ends an operation; what it has written is gone.
#include <cstdio>
#include <filesystem>
#include <stop_token>
#include <thread>

#include <isobrick/isobrick.h>

int main() try {
  const auto source = isobrick::make_synth({.extent = {2000, 2000, 2000}});
  std::stop_source stop;
  std::jthread impatient([&] { stop.request_stop(); });
  isobrick::convert(*source, "large.zarr", {.force = true, .cancel = stop.get_token()});
  return 1;  // nobody ended it
} catch (const isobrick::Cancelled& error) {
  std::printf("%s\n", error.what());
  return std::filesystem::exists("large.zarr") ? 1 : 0;
}
