// HTTP as bytes on a socket, so that tests can also say what no client library would.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <sys/types.h>

namespace isomesh::test {

using Headers = std::vector<std::pair<std::string, std::string>>;

inline Headers with(Headers headers, const Headers& more) {
  headers.insert(headers.end(), more.begin(), more.end());
  return headers;
}

struct Answer {
  int status = 0;
  std::multimap<std::string, std::string> headers;  // names in lower case
  std::string body;                                 // without the lines between chunks

  // The value of the header, whose name is in lower case; empty without one.
  std::string header(const std::string& name) const;
};

// A connection to http://HOST:PORT or unix:PATH. Throws std::runtime_error when there is none, and
// when the server is silent for longer than kLongest.
class Connection {
 public:
  // `from` is the address that it comes from, such as 127.0.0.2; "": whichever the system takes.
  explicit Connection(const std::string& url, const std::string& from = {});
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  // False when the server does not listen any more.
  bool send(std::string_view bytes) const;
  // Nothing more is sent; the server sees the end.
  void finish_sending() const;
  // The first bytes that arrive, at most a few kilobytes; empty at the end.
  std::string receive_some() const;
  // Everything up to the end that the server makes, as an answer. The status is 0 when it is none.
  Answer receive() const;

 private:
  ssize_t receive_into(std::string& block) const;

  int socket_;
};

// The bytes of a request, with Host and, where there is a body or the method wants one,
// Content-Length.
std::string request(const std::string& method, const std::string& target,
                    const std::string& body = {}, const Headers& headers = {});

// Sends the bytes over a new connection, from that address, and returns the answer.
Answer answer_to(const std::string& url, std::string_view bytes, const std::string& from = {});

// The body as one chunk after the other, for Transfer-Encoding: chunked.
std::string chunked(std::string_view body, std::size_t chunk_bytes);

}  // namespace isomesh::test
