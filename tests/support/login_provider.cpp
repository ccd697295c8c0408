#include "tests/support/login_provider.h"

#include <algorithm>
#include <chrono>
#include <mutex>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <vector>

#include <httplib.h>
#include <openssl/bn.h>
#include <openssl/core_names.h>
#include <openssl/ecdsa.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rsa.h>

#include "base/base64.h"

namespace isomesh::test {
namespace {

constexpr int kCurveNumber = 32;

void require(bool is_done) {
  if (!is_done) throw std::runtime_error("OpenSSL makes no key or signature");
}

std::string bytes_of(const BIGNUM* number, int size) {
  std::string bytes(static_cast<std::size_t>(size), '\0');
  require(BN_bn2binpad(number, reinterpret_cast<unsigned char*>(bytes.data()), size) == size);
  return bytes;
}

std::string number_in(const EVP_PKEY* key, const char* name) {
  BIGNUM* number = nullptr;
  require(EVP_PKEY_get_bn_param(key, name, &number) == 1);
  std::string bytes = bytes_of(number, std::max(BN_num_bytes(number), 1));
  BN_free(number);
  return bytes;
}

std::string padded(const std::string& bytes) {
  return std::string(kCurveNumber - bytes.size(), '\0') + bytes;
}

// The two numbers of OpenSSL's form.
std::string as_pair(const std::string& der) {
  const auto* bytes = reinterpret_cast<const unsigned char*>(der.data());
  ECDSA_SIG* pair = d2i_ECDSA_SIG(nullptr, &bytes, static_cast<long>(der.size()));
  require(pair != nullptr);
  std::string numbers = bytes_of(ECDSA_SIG_get0_r(pair), kCurveNumber) +
                        bytes_of(ECDSA_SIG_get0_s(pair), kCurveNumber);
  ECDSA_SIG_free(pair);
  return numbers;
}

}  // namespace

std::string to_base64url(const std::string& bytes) {
  std::string text = to_base64(std::string_view(bytes));
  std::replace(text.begin(), text.end(), '+', '-');
  std::replace(text.begin(), text.end(), '/', '_');
  text.resize(text.find_last_not_of('=') + 1);
  return text;
}

KeyPair::KeyPair(const std::string& algorithm, int bits)
    : algorithm_(algorithm),
      key_(algorithm == "ES256" ? EVP_PKEY_Q_keygen(nullptr, nullptr, "EC", "P-256")
                                : EVP_PKEY_Q_keygen(nullptr, nullptr, "RSA", std::size_t(bits)),
           EVP_PKEY_free) {
  require(key_ != nullptr);
}

std::string KeyPair::sign(const std::string& text) const {
  const std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> digest(EVP_MD_CTX_new(),
                                                                       EVP_MD_CTX_free);
  EVP_PKEY_CTX* context = nullptr;
  require(EVP_DigestSignInit(digest.get(), &context, EVP_sha256(), nullptr, key_.get()) == 1);
  if (algorithm_ == "PS256") {
    require(EVP_PKEY_CTX_set_rsa_padding(context, RSA_PKCS1_PSS_PADDING) == 1);
    require(EVP_PKEY_CTX_set_rsa_pss_saltlen(context, RSA_PSS_SALTLEN_DIGEST) == 1);
  }
  const auto* bytes = reinterpret_cast<const unsigned char*>(text.data());
  std::size_t size = 0;
  require(EVP_DigestSign(digest.get(), nullptr, &size, bytes, text.size()) == 1);
  std::string signature(size, '\0');
  require(EVP_DigestSign(digest.get(), reinterpret_cast<unsigned char*>(signature.data()), &size,
                         bytes, text.size()) == 1);
  signature.resize(size);
  return algorithm_ == "ES256" ? as_pair(signature) : signature;
}

std::string KeyPair::jwk(const std::string& id, const std::string& more) const {
  std::string members = R"({"kid": ")" + id + '"';
  const auto add = [&](const char* name, const std::string& value) {
    members += std::string(", \"") + name + "\": \"" + value + '"';
  };
  if (algorithm_ == "ES256") {
    add("kty", "EC");
    add("crv", "P-256");
    add("x", to_base64url(padded(number_in(key_.get(), OSSL_PKEY_PARAM_EC_PUB_X))));
    add("y", to_base64url(padded(number_in(key_.get(), OSSL_PKEY_PARAM_EC_PUB_Y))));
  } else {
    add("kty", "RSA");
    add("n", to_base64url(number_in(key_.get(), OSSL_PKEY_PARAM_RSA_N)));
    add("e", to_base64url(number_in(key_.get(), OSSL_PKEY_PARAM_RSA_E)));
    if (algorithm_ == "PS256") add("alg", algorithm_);
  }
  return members + (more.empty() ? "" : ", " + more) + '}';
}

std::string KeyPair::public_pem() const {
  BIO* memory = BIO_new(BIO_s_mem());
  require(PEM_write_bio_PUBKEY(memory, key_.get()) == 1);
  char* text = nullptr;
  const long size = BIO_get_mem_data(memory, &text);
  std::string pem(text, static_cast<std::size_t>(size));
  BIO_free(memory);
  return pem;
}

std::string signed_token(const KeyPair& key, const std::string& head, const std::string& payload) {
  const std::string text = to_base64url(head) + '.' + to_base64url(payload);
  return text + '.' + to_base64url(key.sign(text));
}

std::string head_of(const KeyPair& key, const std::string& id) {
  return R"({"alg": ")" + key.algorithm() + R"(", "kid": ")" + id + R"(", "typ": "JWT"})";
}

std::int64_t unix_time() {
  return std::chrono::duration_cast<std::chrono::seconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

std::string claims_of(const std::string& issuer, const std::string& subject,
                      const std::string& more) {
  constexpr std::int64_t kHour = 3600;
  return R"({"iss": ")" + issuer + R"(", "aud": "isomesh", "sub": ")" + subject + R"(", "iat": )" +
         std::to_string(unix_time()) + R"(, "exp": )" + std::to_string(unix_time() + kHour) +
         (more.empty() ? "" : ", " + more) + '}';
}

struct LoginProvider::State {
  httplib::Server http;
  std::string issuer;
  mutable std::mutex mutex;
  std::string keys;
  std::map<std::string, std::string> description;
  int status = 0;
  std::string text;
  int reads = 0;
  std::jthread thread;

  // Returns true if it is broken, with that response.
  bool is_broken(httplib::Response& response) const {
    if (status == 0) return false;
    response.status = status;
    if (status == 302) response.set_header("Location", issuer + "/keys");
    response.set_content(text, "application/json");
    return true;
  }
};

LoginProvider::LoginProvider() : state_(std::make_unique<State>()) {
  State& state = *state_;
  const int port = state.http.bind_to_any_port("127.0.0.1");
  if (port < 0) throw std::runtime_error("no port for a login provider");
  state.issuer = "http://127.0.0.1:" + std::to_string(port);
  state.description = {{"issuer", state.issuer},
                       {"jwks_uri", state.issuer + "/keys"},
                       {"authorization_endpoint", state.issuer + "/authorize"},
                       {"token_endpoint", state.issuer + "/token"}};
  state.http.Get("/.well-known/openid-configuration",
                 [&state](const httplib::Request&, httplib::Response& response) {
                   const std::lock_guard lock(state.mutex);
                   if (state.is_broken(response)) return;
                   std::string members;
                   for (const auto& [name, value] : state.description) {
                     members += (members.empty() ? "\"" : ", \"") + name + "\": \"" + value + '"';
                   }
                   response.set_content('{' + members + '}', "application/json");
                 });
  state.http.Get("/keys", [&state](const httplib::Request&, httplib::Response& response) {
    const std::lock_guard lock(state.mutex);
    ++state.reads;
    response.set_content(R"({"keys": [)" + state.keys + "]}", "application/json");
  });
  state.http.set_keep_alive_max_count(1);
  state.thread = std::jthread([&state] { state.http.listen_after_bind(); });
  while (!state.http.is_running()) std::this_thread::yield();
}

LoginProvider::~LoginProvider() { state_->http.stop(); }

const std::string& LoginProvider::issuer() const { return state_->issuer; }

void LoginProvider::publish(const std::string& keys) {
  const std::lock_guard lock(state_->mutex);
  state_->keys = keys;
}

void LoginProvider::break_with(int status, const std::string& text) {
  const std::lock_guard lock(state_->mutex);
  state_->status = status;
  state_->text = text;
}

void LoginProvider::describe(const std::string& name, const std::string& value) {
  const std::lock_guard lock(state_->mutex);
  state_->description[name] = value;
}

int LoginProvider::reads() const {
  const std::lock_guard lock(state_->mutex);
  return state_->reads;
}

}  // namespace isomesh::test
