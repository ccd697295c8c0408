// A daemon that was built without the hospital.
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/api/daemon.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;

TEST(WithoutHospital, TheOptionIsRejectedWithItsReason) {
  const TemporaryFolder folder;
  write_file(folder / "hospital.toml", "");
  const std::vector<std::string> start = {
      ISOMESHD,      "--data",     folder / "data",         "--listen",
      "127.0.0.1:0", "--hospital", folder / "hospital.toml"};
  for (const auto& command : {start, with(start, {"--check-config"})}) {
    const Finished refused = run(command);
    EXPECT_EQ(refused.status, 1);
    EXPECT_THAT(refused.errors, HasSubstr("it was built without"));
  }
}

TEST(WithoutHospital, ThereAreNoOrders) {
  const Daemon daemon;
  EXPECT_THAT(daemon.get("/version").body, HasSubstr("\"orders\":false"));
  for (const char* path : {"/v1/orders", "/v1/pacs", "/v1/pacs/main/series?date=20261130"}) {
    EXPECT_EQ(daemon.get(path).status, 404) << path;
  }
}

}  // namespace
}  // namespace isomesh
