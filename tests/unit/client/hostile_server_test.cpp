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

TEST(HostileServer, SendsAnEventWithoutEnd) {
  SocketServer server([](int socket) {
    test::read_head(socket);
    test::send_text(socket, "HTTP/1.1 200 OK\r\n\r\nevent: done\n");
    const std::string line = "data: " + std::string(1000, 'a') + '\n';
    for (int n = 0; n < 20'000; ++n) test::send_text(socket, line);
  });
  Client client({.server = server.url()});
  EXPECT_STREQ(error_of([&] { client.follow("7", {}); }).what(),
               "the server's events do not match the API");
}

TEST(HostileServer, SendsPagesWithoutEnd) {
  const std::string page = R"({"volumes": [)" + to_json(test::some_volume()) +
                           R"(], "next": "more", "more": ")" +
                           std::string(std::size_t{60} << 20, 'a') + "\"}";
  test::FakeServer server;
  server.http.Get("/v1/volumes", test::answering(page));
  Client client({.server = server.start()});
  EXPECT_EQ(error_of([&] { client.volumes(); }).code(), ErrorCode::kInternal);
}

// Each result of an upload is a volume or a problem.
TEST(HostileServer, AnswersAnUploadWithOtherResults) {
  const std::string volume = to_json(test::some_volume());
  const std::string problem = to_json(to_problem(Error(ErrorCode::kTooLarge, "large"), ""));
  const auto result = [](const std::string& of_volume, const std::string& of_problem) {
    return R"({"member": "a", "status": 201, "volume": )" + of_volume + R"(, "problem": )" +
           of_problem + '}';
  };
  std::string results;
  test::FakeServer server;
  server.http.Post("/v1/volumes", [&](const auto&, auto& response, const auto& read) {
    read([](const char*, std::size_t) { return true; });
    response.status = 207;
    response.set_content("{\"volumes\": [" + results + "]}", "application/json");
  });
  test::TemporaryFolder folder;
  test::write_file(folder / "a", "x");
  Client client({.server = server.start()});
  const auto code = [&](const std::string& answer) {
    results = answer;
    return error_of([&] { client.upload_all({folder / "a"}); }).code();
  };
  EXPECT_EQ(code(""), ErrorCode::kInternal);
  EXPECT_EQ(code(result("null", "null")), ErrorCode::kInternal);
  EXPECT_EQ(code(result(volume, "null") + ',' + result("null", "null")), ErrorCode::kInternal);
  EXPECT_EQ(code(result(volume, problem)), ErrorCode::kInternal);
  EXPECT_EQ(code(result("null", problem)), ErrorCode::kTooLarge);
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
