#include "server/net/descriptors.h"

#include <algorithm>
#include <cstdlib>
#include <iostream>

#include <gtest/gtest.h>
#include <sys/resource.h>

#include "base/error.h"

namespace isomesh::net {
namespace {

TEST(Descriptors, TheSoftLimitBecomesTheHardOne) {
  rlimit before = {};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  const rlimit low = {before.rlim_max / 2, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &low), 0);
  EXPECT_EQ(raise_descriptor_limit(), before.rlim_max);
  rlimit after = {};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &after), 0);
  EXPECT_EQ(after.rlim_cur, before.rlim_max);
  ::setrlimit(RLIMIT_NOFILE, &before);
}

// Ends the process, with 1 and the error if the limit is too low.
[[noreturn]] void raise_within(rlim_t most) {
  const rlimit few = {most / 2, most};
  if (::setrlimit(RLIMIT_NOFILE, &few) != 0) std::_Exit(2);
  try {
    std::_Exit(raise_descriptor_limit() == most ? 0 : 3);
  } catch (const Error& error) {
    std::cerr << error.what();
    std::_Exit(1);
  }
}

TEST(Descriptors, TooFewAreRefusedWithWhatIsNeeded) {
  EXPECT_EXIT(raise_within(kFewestDescriptors), testing::ExitedWithCode(0), "");
  EXPECT_EXIT(raise_within(kFewestDescriptors - 1), testing::ExitedWithCode(1),
              "at least 128 file descriptors are needed, and the limit is 127");
}

// Connections and the files that they send leave some for the service itself.
TEST(Descriptors, ConnectionsLeaveAReserve) {
  for (const std::size_t descriptors : {128U, 256U, 1024U, 4096U, 65536U, 1048576U}) {
    const std::size_t connections = connections_within(descriptors);
    EXPECT_GE(connections, 8U) << descriptors;
    EXPECT_LE(connections * 2, descriptors - std::min<std::size_t>(384, descriptors / 2))
        << descriptors;
  }
  EXPECT_EQ(connections_within(1024), 320U);
  EXPECT_EQ(connections_within(1048576), 4096U);
}

}  // namespace
}  // namespace isomesh::net
