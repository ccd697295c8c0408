#include "server/hospital/c_store/sender.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/text.h"
#include "server/net/listener.h"

namespace isomesh::c_store {
namespace {

// A PACS that accepts a connection, and a process that stands in for isomesh-dimse.
class SenderTest : public testing::Test {
 protected:
  SenderTest() {
    const std::string authority = pacs_.authority();
    settings_.host = "127.0.0.1";
    settings_.port = static_cast<std::uint16_t>(
        parse_uint64(authority.substr(authority.rfind(':') + 1)).value());
  }

  const net::Listener pacs_{net::parse_address("127.0.0.1:0")};
  process::PreparedProcesses processes_{LATE_DIMSE, 1};
  orders::PacsSettings settings_;
};

TEST_F(SenderTest, AnObjectThatTookTooLongIsNoResponseOfThePacs) {
  Sender sender(settings_, processes_);
  try {
    sender.store({}, {});
    FAIL() << "nothing was thrown";
  } catch (const orders::PacsFailure& failure) {
    EXPECT_EQ(failure.fault(), orders::PacsFault::kTimeout);
    EXPECT_STREQ(failure.what(),
                 "sending the object took too long: it ended after all of its processor time");
  }
}

// Its UID depends on the contents, so an earlier attempt stored it.
TEST_F(SenderTest, AnObjectThatThePacsHasIsStored) {
  Sender sender(settings_, processes_);
  orders::OutgoingObject object;
  object.place.instance = "1.2";
  EXPECT_NO_THROW(sender.store(object, {}));
}

}  // namespace
}  // namespace isomesh::c_store
