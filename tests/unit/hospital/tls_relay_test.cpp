#include "server/hospital/c_store/tls_relay.h"

#include <array>
#include <csignal>
#include <cstdio>
#include <string>
#include <thread>

#include <gtest/gtest.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>
#include <sys/socket.h>

#include "server/net/tls_context.h"
#include "server/process/child.h"
#include "tests/support/files.h"
#include "tests/support/process.h"

namespace isomesh::c_store {
namespace {

using net::TlsFault;
using net::TlsStream;

// A certificate that is its own authority, and its key, as files.
class Certificate {
 public:
  explicit Certificate(const std::string& name, long days = 1) {
    const std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)> key(
        EVP_PKEY_Q_keygen(nullptr, nullptr, "EC", "P-256"), &EVP_PKEY_free);
    const std::unique_ptr<X509, decltype(&X509_free)> made(X509_new(), &X509_free);
    X509* const x509 = made.get();
    X509_set_version(x509, X509_VERSION_3);
    ASN1_INTEGER_set(X509_get_serialNumber(x509), 1);
    constexpr long kDay = 24 * 3600;
    X509_gmtime_adj(X509_getm_notBefore(x509), -2 * kDay);
    X509_gmtime_adj(X509_getm_notAfter(x509), days * kDay);
    X509_set_pubkey(x509, key.get());
    X509_NAME* const subject = X509_get_subject_name(x509);
    X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_ASC,
                               reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1, 0);
    X509_set_issuer_name(x509, subject);
    X509_sign(x509, key.get(), EVP_sha256());
    write(file(), [&](std::FILE* to) { return PEM_write_X509(to, x509); });
    write(key_file(), [&](std::FILE* to) {
      return PEM_write_PrivateKey(to, key.get(), nullptr, nullptr, 0, nullptr, nullptr);
    });
  }

  std::filesystem::path file() const { return folder_.path() / "certificate.pem"; }
  std::filesystem::path key_file() const { return folder_.path() / "key.pem"; }

 private:
  template <class Write>
  static void write(const std::filesystem::path& path, const Write& write_to) {
    std::FILE* const to = std::fopen(path.c_str(), "w");
    ASSERT_NE(to, nullptr);
    EXPECT_EQ(write_to(to), 1);
    std::fclose(to);
  }

  const test::TemporaryFolder folder_;
};

// Null authorities or own certificate: none.
net::TlsIdentity identity_of(const Certificate* own, const Certificate* authority) {
  net::TlsIdentity identity;
  if (own != nullptr) {
    identity.certificate = {.option = "certificate", .path = own->file()};
    identity.key = {.option = "key", .path = own->key_file()};
  }
  if (authority != nullptr) {
    identity.authorities = {.option = "authorities", .path = authority->file()};
  }
  return identity;
}

// Reads until the end.
std::string all_of(const Descriptor& socket) {
  std::string text;
  std::array<char, 65536> piece = {};
  ssize_t count = 0;
  while ((count = ::recv(socket.number(), piece.data(), piece.size(), 0)) > 0) {
    text.append(piece.data(), static_cast<std::size_t>(count));
  }
  return text;
}

void send_all(const Descriptor& socket, std::string_view text) {
  while (!text.empty()) {
    const ssize_t count = ::send(socket.number(), text.data(), text.size(), MSG_NOSIGNAL);
    ASSERT_GT(count, 0);
    text.remove_prefix(static_cast<std::size_t>(count));
  }
}

class TlsRelayTest : public testing::Test {
 protected:
  // OpenSSL writes to closed connections; the daemon ignores this signal, too.
  TlsRelayTest() { std::signal(SIGPIPE, SIG_IGN); }

  std::unique_ptr<TlsRelay> server(Descriptor socket, const Certificate* clients) const {
    return std::make_unique<TlsRelay>(
        std::make_unique<TlsStream>(net::tls_server_context(identity_of(&server_, clients)).get(),
                                    socket.release(), TlsStream::Side::kServer));
  }

  std::unique_ptr<TlsRelay> client(Descriptor socket, const Certificate* own,
                                   const Certificate& trusted,
                                   const std::string& name = "server") const {
    auto stream =
        std::make_unique<TlsStream>(net::tls_client_context(identity_of(own, &trusted)).get(),
                                    socket.release(), TlsStream::Side::kClient);
    net::expect_name(stream->ssl(), name);
    return std::make_unique<TlsRelay>(std::move(stream));
  }

  // The faults that client and server find.
  using Faults = std::pair<TlsFault, TlsFault>;
  Faults faults(const Certificate* own, const Certificate& trusted, const Certificate* clients,
                const std::string& name = "server") const {
    process::SocketPair wire = process::make_socket_pair();
    const auto there = server(std::move(wire.theirs), clients);
    const auto here = client(std::move(wire.ours), own, trusted, name);
    EXPECT_EQ(all_of(here->take_plain_end()), "");
    EXPECT_EQ(all_of(there->take_plain_end()), "");
    return {here->fault(), there->fault()};
  }

  const Certificate server_{"server"};
  const Certificate client_{"client"};
};

TEST_F(TlsRelayTest, CarriesBothWaysAndTellsTheName) {
  process::SocketPair wire = process::make_socket_pair();
  auto there = server(std::move(wire.theirs), &client_);
  auto here = client(std::move(wire.ours), &client_, server_);
  const Descriptor request = here->take_plain_end();
  const Descriptor response = there->take_plain_end();
  const std::string much(3'000'000, 'x');  // more than all buffers
  std::jthread sending([&] { send_all(request, much); });
  std::array<char, 1> first = {};
  ASSERT_EQ(::recv(response.number(), first.data(), 1, 0), 1);
  EXPECT_TRUE(there->is_certified_as("client"));
  EXPECT_FALSE(there->is_certified_as("server"));
  EXPECT_FALSE(there->has_answered());
  send_all(response, "the end");
  std::array<char, 7> answer = {};
  ASSERT_EQ(::recv(request.number(), answer.data(), answer.size(), MSG_WAITALL), 7);
  EXPECT_TRUE(test::eventually([&] { return there->has_answered(); }));
  std::string rest(much.size() - 1, ' ');
  EXPECT_EQ(::recv(response.number(), rest.data(), rest.size(), MSG_WAITALL),
            static_cast<ssize_t>(rest.size()));
  EXPECT_EQ(rest, much.substr(1));
}

// As an association that ends with its last message.
TEST_F(TlsRelayTest, SendsTheLastBytes) {
  process::SocketPair wire = process::make_socket_pair();
  auto there = server(std::move(wire.theirs), nullptr);
  auto here = client(std::move(wire.ours), nullptr, server_);
  Descriptor request = here->take_plain_end();
  const Descriptor response = there->take_plain_end();
  send_all(request, "a");
  std::array<char, 1> first = {};
  ASSERT_EQ(::recv(response.number(), first.data(), 1, 0), 1);
  send_all(request, "release");
  request = Descriptor();
  here.reset();
  EXPECT_EQ(all_of(response), "release");
  EXPECT_EQ(there->fault(), TlsFault::kNone);
}

TEST_F(TlsRelayTest, TellsWhoIsNotTrusted) {
  const Certificate stranger("server");
  const Certificate expired("client", -1);
  EXPECT_EQ(faults(nullptr, stranger, nullptr),
            Faults(TlsFault::kUnknownAuthority, TlsFault::kRefused));
  EXPECT_EQ(faults(nullptr, server_, nullptr, "other"),
            Faults(TlsFault::kWrongName, TlsFault::kRefused));
  EXPECT_EQ(faults(nullptr, server_, &client_), Faults(TlsFault::kRefused, TlsFault::kMissing));
  EXPECT_EQ(faults(&stranger, server_, &client_),
            Faults(TlsFault::kRefused, TlsFault::kUnknownAuthority));
  EXPECT_EQ(faults(&expired, server_, &expired), Faults(TlsFault::kRefused, TlsFault::kExpired));
}

TEST_F(TlsRelayTest, TellsAPeerWithoutTls) {
  process::SocketPair wire = process::make_socket_pair();
  auto there = server(std::move(wire.theirs), nullptr);
  const std::string request("\1\0\0\0\0\4\0\1\0\0", 10);  // the start of an A-ASSOCIATE-RQ
  send_all(wire.ours, request);
  ::shutdown(wire.ours.number(), SHUT_WR);
  EXPECT_EQ(all_of(there->take_plain_end()), "");
  EXPECT_EQ(there->fault(), TlsFault::kNotTls);
}

TEST_F(TlsRelayTest, EndsInTheMiddleOfAHandshake) {
  process::SocketPair wire = process::make_socket_pair();
  auto there = server(std::move(wire.theirs), nullptr);
  there.reset();
  EXPECT_EQ(all_of(wire.ours), "");
}

TEST(TlsFaults, HaveTextsWithAWayOut) {
  EXPECT_EQ(net::text_of(TlsFault::kExpired, "the PACS"),
            "the certificate of the PACS has expired: it must be renewed there");
  EXPECT_EQ(net::text_of(TlsFault::kMissing, "the peer"),
            "the peer has no certificate, but needs one of the authorities in ca-file");
}

}  // namespace
}  // namespace isomesh::c_store
