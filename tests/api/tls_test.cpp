// The daemon with a certificate of its own.
#include <chrono>
#include <csignal>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/isomesh/client.h"
#include "tests/api/daemon.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;
using testing::StartsWith;

class TlsTest : public testing::Test {
 protected:
  TlsTest() { make_certificate("/CN=first"); }

  void make_certificate(const std::string& subject) const {
    const Finished result =
        run({"openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256",
             "-nodes", "-days", "2", "-subj", subject, "-addext", "subjectAltName=IP:127.0.0.1",
             "-keyout", folder_ / "key.pem", "-out", folder_ / "cert.pem"});
    EXPECT_EQ(result.status, 0) << result.errors;
  }

  std::vector<std::string> options() const {
    return {"--tls-cert", folder_ / "cert.pem", "--tls-key", folder_ / "key.pem"};
  }

  // A GET with that version of TLS and no other; the status is curl's.
  Finished curl(const Daemon& daemon, const std::vector<std::string>& arguments) const {
    return run(with(with({"curl", "--silent", "--show-error", "--max-time", "30", "--cacert",
                          folder_ / "cert.pem"},
                         arguments),
                    {daemon.url() + "/livez"}));
  }

  std::string subject_seen(const Daemon& daemon) const {
    const Finished result = curl(daemon, {"--verbose"});
    return result.errors.find("CN=second") != std::string::npos ? "second" : "first";
  }

  const TemporaryFolder folder_;
};

TEST_F(TlsTest, EverythingGoesThroughIt) {
  const Daemon daemon(folder_ / "data", "127.0.0.1:0", options());
  EXPECT_THAT(daemon.url(), StartsWith("https://127.0.0.1:"));
  const auto command = [&](const std::vector<std::string>& arguments) {
    return daemon.command(with({"--ca", folder_ / "cert.pem"}, arguments));
  };
  // More than fits into one record or the sockets' buffers.
  const RawUpload noise = raw_upload(test::noise<std::uint8_t>({0, 100}, {64, 64, 64}, 3));
  write_file(folder_ / "volume.raw", noise.bytes);
  const Finished result = command(with(
      {"mesh", folder_ / "volume.raw", "--iso", "50", "--passes", "1", "-o", folder_ / "mesh.stl"},
      noise.options));
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_GT(std::filesystem::file_size(folder_ / "mesh.stl"), 10'000'000U);
  EXPECT_EQ(command({"list"}).status, 0);
}

TEST_F(TlsTest, ACertificateThatNobodyTrustsIsRefusedByTheClient) {
  const Daemon daemon(folder_ / "data", "127.0.0.1:0", options());
  const Finished result = daemon.command({"list"});
  EXPECT_EQ(result.status, 3);
  EXPECT_THAT(result.errors, HasSubstr("certificate"));
}

TEST_F(TlsTest, OldVersionsAndPlainRequestsAreNotServed) {
  const Daemon daemon(folder_ / "data", "127.0.0.1:0", options());
  EXPECT_EQ(curl(daemon, {"--tls-max", "1.2"}).output, "ok\n");
  EXPECT_EQ(curl(daemon, {"--tlsv1.3"}).output, "ok\n");
  const std::string weak = "DEFAULT@SECLEVEL=0";
  EXPECT_NE(curl(daemon, {"--tlsv1.0", "--tls-max", "1.1", "--ciphers", weak}).status, 0);
  EXPECT_NE(answer_to(daemon.url(), request("GET", "/livez")).status, 200);
  EXPECT_EQ(curl(daemon, {}).output, "ok\n");
}

TEST_F(TlsTest, SlowHandshakesHoldUpNobody) {
  const Daemon daemon(folder_ / "data", "127.0.0.1:0", options());
  std::vector<std::unique_ptr<Connection>> slow;
  for (int n = 0; n < 64; ++n) {
    slow.push_back(std::make_unique<Connection>(daemon.url()));
    if (n % 2 == 0) slow.back()->send("\x16\x03\x01");  // the beginning of a greeting
  }
  // Slow ones are given up after ten seconds. The machine may have other things to do: one prompt
  // answer of some shows that nothing else was in the way.
  const auto answers_at_once = [&] {
    const auto begin = std::chrono::steady_clock::now();
    EXPECT_EQ(curl(daemon, {}).output, "ok\n");
    return std::chrono::steady_clock::now() - begin < std::chrono::seconds(5);
  };
  EXPECT_TRUE(answers_at_once() || answers_at_once() || answers_at_once());
}

TEST_F(TlsTest, ACertificateIsRenewedOnSighup) {
  Daemon daemon(folder_ / "data", "127.0.0.1:0", options());
  EXPECT_EQ(subject_seen(daemon), "first");
  make_certificate("/CN=second");
  daemon.send_signal(SIGHUP);
  EXPECT_TRUE(eventually([&] { return subject_seen(daemon) == "second"; }));
  write_file(folder_ / "key.pem", "no key");
  daemon.send_signal(SIGHUP);
  EXPECT_TRUE(eventually([&] { return daemon.errors().find("stays") != std::string::npos; }));
  EXPECT_EQ(subject_seen(daemon), "second");
}

TEST_F(TlsTest, FilesThatDoNotFitAreRefused) {
  write_file(folder_ / "none.pem", "no certificate");
  const std::string cert = folder_ / "cert.pem";
  const std::string none = folder_ / "none.pem";
  for (const std::vector<std::string>& wrong :
       std::vector<std::vector<std::string>>{{"--tls-cert", cert},
                                             {"--tls-cert", none, "--tls-key", none},
                                             {"--tls-cert", cert, "--tls-key", none},
                                             {"--tls-cert", cert, "--tls-key", cert}}) {
    const Finished result = refused_start(folder_ / "data", wrong);
    EXPECT_NE(result.status, 0);
    EXPECT_THAT(result.output + result.errors, HasSubstr("tls-"));
  }
}

TEST_F(TlsTest, AWeakKeyIsRefusedAsSuch) {
  const std::string cert = folder_ / "weak.pem";
  const std::string key = folder_ / "weak.key";
  ASSERT_EQ(run({"openssl", "req", "-x509", "-newkey", "rsa:1024", "-nodes", "-days", "2", "-subj",
                 "/CN=localhost", "-keyout", key, "-out", cert})
                .status,
            0);
  const Finished result = refused_start(folder_ / "data", {"--tls-cert", cert, "--tls-key", key});
  EXPECT_NE(result.status, 0);
  EXPECT_THAT(result.output + result.errors, HasSubstr("too weak"));
}

TEST_F(TlsTest, AUnixSocketStaysPlain) {
  const Daemon daemon(folder_ / "data", "unix:" + std::string(folder_ / "s"), options());
  EXPECT_EQ(daemon.get("/livez").status, 200);
}

}  // namespace
}  // namespace isomesh
