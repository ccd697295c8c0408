#include "server/hospital/c_store/sender.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/text.h"
#include "server/net/listener.h"

namespace isomesh::c_store {
namespace {

TEST(Sender, AnObjectThatTookTooLongIsNoResponseOfThePacs) {
  const net::Listener pacs(net::parse_address("127.0.0.1:0"));
  const std::string authority = pacs.authority();
  const auto port = parse_uint64(authority.substr(authority.rfind(':') + 1));
  process::PreparedProcesses processes(LATE_DIMSE, 1);
  orders::PacsSettings settings;
  settings.host = "127.0.0.1";
  settings.port = static_cast<std::uint16_t>(port.value());
  Sender sender(settings, processes);
  try {
    sender.store({}, {});
    FAIL() << "nothing was thrown";
  } catch (const orders::PacsFailure& failure) {
    EXPECT_EQ(failure.fault(), orders::PacsFault::kTimeout);
    EXPECT_STREQ(failure.what(),
                 "sending the object took too long: it ended after all of its processor time");
  }
}

}  // namespace
}  // namespace isomesh::c_store
