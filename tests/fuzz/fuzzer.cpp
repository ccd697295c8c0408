// libFuzzer's entry for one target, ISOMESH_FUZZ_TARGET. With ISOMESH_FUZZ_SEEDS in the environment
// the target's corpus is first written into that folder.
#include <cstdint>
#include <cstdlib>
#include <fstream>

#include "tests/fuzz/targets.h"

namespace {

void write_seeds(const std::string& folder) {
  int number = 0;
  for (const std::string& seed : isomesh::fuzz::corpus(ISOMESH_FUZZ_TARGET)) {
    std::ofstream(folder + "/seed-" + std::to_string(number++), std::ios::binary) << seed;
  }
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  if (const char* folder = std::getenv("ISOMESH_FUZZ_SEEDS")) write_seeds(folder);
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const isomesh::fuzz::Target& target = isomesh::fuzz::target(ISOMESH_FUZZ_TARGET);
  target.run(std::as_bytes(std::span(data, size)));
  return 0;
}
