// libFuzzer's entry for one target, which the environment names: ISOMESH_FUZZ_TARGET. With
// ISOMESH_FUZZ_SEEDS the target's corpus is first written into that folder.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <stdexcept>

#include "tests/fuzz/targets.h"

namespace {

using isomesh::fuzz::Target;

const Target& chosen() {
  const char* name = std::getenv("ISOMESH_FUZZ_TARGET");
  try {
    return isomesh::fuzz::target(name == nullptr ? "" : name);
  } catch (const std::out_of_range&) {
    std::fputs("ISOMESH_FUZZ_TARGET must be one of", stderr);
    for (const Target& each : isomesh::fuzz::targets()) {
      std::fprintf(stderr, " %.*s", static_cast<int>(each.name.size()), each.name.data());
    }
    std::fputc('\n', stderr);
    std::exit(EXIT_FAILURE);
  }
}

void write_seeds(const std::string& folder) {
  int number = 0;
  for (const std::string& seed : isomesh::fuzz::corpus(chosen().name)) {
    std::ofstream(folder + "/seed-" + std::to_string(number++), std::ios::binary) << seed;
  }
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  if (const char* folder = std::getenv("ISOMESH_FUZZ_SEEDS")) write_seeds(folder);
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Target& target = chosen();
  target.run(std::as_bytes(std::span(data, size)));
  return 0;
}
