// Owners of libcurl's handles. Header only, for targets that link libcurl.
#pragma once

#include <filesystem>
#include <memory>
#include <new>
#include <string>

#include <curl/curl.h>

#include "base/error.h"

namespace isomesh::curl {

struct EasyCleanup {
  void operator()(CURL* easy) const { curl_easy_cleanup(easy); }
};
struct MultiCleanup {
  void operator()(CURLM* multi) const { curl_multi_cleanup(multi); }
};
struct ListCleanup {
  void operator()(curl_slist* list) const { curl_slist_free_all(list); }
};
using Easy = std::unique_ptr<CURL, EasyCleanup>;
using Multi = std::unique_ptr<CURLM, MultiCleanup>;
using Headers = std::unique_ptr<curl_slist, ListCleanup>;

// Call before any other function of libcurl. Throws Error kInternal.
inline void start() {
  // curl_global_init is not thread safe in every version, so it is called once.
  static const CURLcode ready = curl_global_init(CURL_GLOBAL_DEFAULT);
  if (ready != CURLE_OK) throw Error(ErrorCode::kInternal, "libcurl cannot be used");
}

inline Multi make_multi() {
  start();
  Multi multi(curl_multi_init());
  if (!multi) throw Error(ErrorCode::kInternal, "libcurl cannot be used");
  return multi;
}

inline Easy make_easy() {
  start();
  Easy easy(curl_easy_init());
  if (!easy) throw Error(ErrorCode::kInternal, "libcurl cannot be used");
  return easy;
}

// Disables proxies and redirects: volumes and secrets must only reach the named server.
// `authorities` is a file of trusted certificates; empty: the system's.
inline void connect_directly(CURL* easy, const std::filesystem::path& authorities) {
  curl_easy_setopt(easy, CURLOPT_PROTOCOLS_STR, "http,https");
  curl_easy_setopt(easy, CURLOPT_FOLLOWLOCATION, 0L);
  curl_easy_setopt(easy, CURLOPT_PROXY, "");
  curl_easy_setopt(easy, CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(easy, CURLOPT_SSLVERSION, static_cast<long>(CURL_SSLVERSION_TLSv1_2));
  if (authorities.empty()) return;
  curl_easy_setopt(easy, CURLOPT_CAINFO, authorities.c_str());
  // Otherwise libcurl also trusts the system's folder of certificates.
  curl_easy_setopt(easy, CURLOPT_CAPATH, static_cast<char*>(nullptr));
}

// Appends a header line, which must not hold control characters.
inline void append(Headers& headers, const std::string& line) {
  curl_slist* longer = curl_slist_append(headers.get(), line.c_str());
  if (longer == nullptr) throw std::bad_alloc();
  static_cast<void>(headers.release());
  headers.reset(longer);
}

}  // namespace isomesh::curl
