// Whatever a server sends, the client ends with an Error and bounded memory.
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/isomesh/client.h"
#include "proto/json.h"
#include "tests/unit/client/support.h"

namespace isomesh {
namespace {

using test::error_of;
using test::SocketServer;

// `cancel` reads no body and `job` does; neither may crash.
std::vector<ErrorCode> codes_for(const std::string& sent) {
  SocketServer server([&](int socket) {
    test::read_head(socket);
    test::send_text(socket, sent);
  });
  Client client({.server = server.url(), .silence_timeout = std::chrono::seconds{5}});
  return {error_of([&] { client.job("7"); }).code(), error_of([&] { client.volumes(); }).code()};
}

class Garbage : public testing::TestWithParam<std::string> {};

TEST_P(Garbage, InPlaceOfHttpIsNoAnswer) {
  EXPECT_THAT(codes_for(GetParam()), testing::Each(ErrorCode::kUnreachable));
}

INSTANTIATE_TEST_SUITE_P(
    Heads, Garbage,
    testing::Values("", "SSH-2.0-OpenSSH_9.2\r\n", "\r\n\r\n", "HTTP/9.9 200 OK\r\n\r\n",
                    "HTTP/1.1 99999 OK\r\n\r\n", "HTTP/1.1 200 OK\r\nContent-Le",
                    "HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\nshort",
                    "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\nab",
                    "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\nffffffffffffffff\r\na",
                    "HTTP/1.1 100 Continue\r\n\r\nHTTP/1.1 " + std::string(500'000, 'a') + "\r\n",
                    "HTTP/1.1 200 " + std::string(500'000, 'a') + "\r\n\r\n",
                    "HTTP/1.1 200 OK\r\nX: " + std::string(500'000, 'a') + "\r\n\r\n",
                    std::string(500'000, '\0'), "HTTP/1.1 100 Continue\r\n\r\n"));

TEST(HostileServer, SendsHeadersWithoutEnd) {
  std::string head = "HTTP/1.1 200 OK\r\n";
  for (int n = 0; n < 20'000; ++n) head += "X-" + std::to_string(n) + ": y\r\n";
  EXPECT_THAT(codes_for(head), testing::Each(ErrorCode::kUnreachable));
}

TEST(HostileServer, SendsInterimAnswersWithoutEnd) {
  std::string sent;
  for (int n = 0; n < 5'000; ++n) sent += "HTTP/1.1 100 Continue\r\n\r\n";
  sent += "HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\n{}";
  EXPECT_THAT(codes_for(sent), testing::Each(ErrorCode::kUnreachable));
}

// A line break in an id would add a header to the request that takes the stream up again.
TEST(HostileServer, SendsAnEventIdWithALineBreak) {
  test::SocketServer server([](int socket) {
    test::read_head(socket);
    test::send_text(socket,
                    "HTTP/1.1 200 OK\r\nContent-Length: 1000\r\n\r\n"
                    "id: 1\rX: y\nevent: stage\ndata: " +
                        to_json(JobEvent{JobState::kRunning, Stage::kLoad, 0.5}) + "\n\n");
  });
  Client client({.server = server.url()});
  EXPECT_EQ(error_of([&] { client.follow("7", {}); }).code(), ErrorCode::kInvalidParameter);
  EXPECT_EQ(server.connections(), 1);
}

TEST(HostileServer, SendsAnEndlessBody) {
  SocketServer server([](int socket) {
    test::read_head(socket);
    test::send_text(socket, "HTTP/1.1 200 OK\r\n\r\n");
    const std::string piece(1 << 20, 'a');
    for (int n = 0; n < 80; ++n) test::send_text(socket, piece);
  });
  Client client({.server = server.url()});
  EXPECT_EQ(error_of([&] { client.volumes(); }).code(), ErrorCode::kInternal);
}

// As a portal of a network does.
TEST(HostileServer, IsOneOfPagesAndNotOfTheApi) {
  std::string status = "200 OK";
  std::string head = "Content-Type: text/html\r\nContent-Length: 6\r\n\r\n<html>";
  SocketServer server([&](int socket) {
    test::read_head(socket);
    test::send_text(socket, "HTTP/1.1 " + status + "\r\n" + head);
  });
  Client client({.server = server.url()});
  test::TemporaryFolder folder;
  test::write_file(folder / "slice.png", "old");
  const auto slice = [&] { client.slice("7", {}, folder / "slice.png"); };
  EXPECT_EQ(error_of(slice).code(), ErrorCode::kInternal);
  EXPECT_EQ(error_of([&] { client.cancel("7"); }).code(), ErrorCode::kInternal);
  EXPECT_EQ(error_of([&] { client.erase_volume("7"); }).code(), ErrorCode::kInternal);
  status = "204 No Content";
  head = "Content-Type: image/png\r\n\r\n";
  EXPECT_EQ(error_of(slice).code(), ErrorCode::kInternal);
  EXPECT_NO_THROW(client.erase_volume("7"));
  EXPECT_EQ(test::read_file(folder / "slice.png"), "old");
}

TEST(HostileServer, RefusesWithAProblemThatIsNone) {
  for (const std::string body : {"", "{", "[]", "{\"status\": \"x\"}", "{\"errors\": 7}"}) {
    SocketServer server([&](int socket) {
      test::read_head(socket);
      test::answer(socket, "422 No\r\nContent-Type: application/problem+json", body);
    });
    Client client({.server = server.url()});
    EXPECT_EQ(error_of([&] { client.job("7"); }).code(), ErrorCode::kUnusableVolume) << body;
  }
}

}  // namespace
}  // namespace isomesh
