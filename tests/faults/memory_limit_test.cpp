// A daemon whose addresses are limited (ulimit -v), as some batch systems do it.
#include <csignal>
#include <cstdint>
#include <initializer_list>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/api/daemon.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // they need terabytes

void expect_service_or_message(std::uint64_t mebibytes) {
  const TemporaryFolder folder;
  Process process({"prlimit", "--as=" + std::to_string(mebibytes << 20), ISOMESHD, "--listen",
                   "127.0.0.1:0", "--data", folder / "data"});
  const std::string line = process.first_line();
  if (line.starts_with("listening on ")) {
    EXPECT_EQ(answer_to(line.substr(13), request("GET", "/livez")).status, 200);
    process.send_signal(SIGTERM);
    EXPECT_EQ(process.wait(), 0) << process.errors();
    return;
  }
  const int status = process.wait();
  constexpr int kOfLoader = 127;  // which finds no room for the program's libraries
  EXPECT_THAT(status, testing::AnyOf(1, kOfLoader)) << process.errors();
  if (status == 1) {
    EXPECT_THAT(process.errors(), HasSubstr("isomeshd: "));
    EXPECT_THAT(process.errors(), HasSubstr("memory"));
  }
}

// Timing decides which thread runs out of memory.
TEST(MemoryLimit, TheDaemonListensOrSaysWhyNot) {
  for (const std::uint64_t mebibytes : std::initializer_list<std::uint64_t>{
           60, 100, 150, 200, 220, 240, 260, 280, 300, 320, 350, 400, 450, 500, 600, 800, 1200}) {
    SCOPED_TRACE(std::to_string(mebibytes) + " MiB");
    expect_service_or_message(mebibytes);
  }
}

#endif

}  // namespace
}  // namespace isomesh
