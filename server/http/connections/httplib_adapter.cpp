#include "server/http/connections/httplib_adapter.h"

#include <chrono>
#include <cstddef>
#include <limits>
#include <string>
#include <string_view>
#include <utility>

#include <httplib.h>

#include "base/clock.h"
#include "server/http/limits.h"
#include "server/http/requests/request_values.h"

namespace isomesh::http {
namespace {

// The library rejects a second question mark, which is an ordinary character of a query.
std::string with_one_question_mark(const std::string& target) {
  std::string result;
  for (std::size_t at = 0, query = target.find('?'); at < target.size(); ++at) {
    if (target[at] == '?' && at > query) {
      result += "%3F";
    } else {
      result += target[at];
    }
  }
  return result;
}

// The library reads a form only if a line break follows its last boundary, which RFC 2046, 5.1.1
// does not require. The break is added; what follows the last boundary is ignored, so a second
// break does not matter.
constexpr std::string_view kFormEnd = "\r\n";

constexpr std::size_t kPieceBytes = std::size_t{64} << 10;

constexpr const char* kAcceptEncoding = "Accept-Encoding";

// The library's view of a connection. It reads a head without headers, because it decodes percent
// signs in headers and is too lenient, and then the body of a form, up to its end: it has no
// length, because it was decoded from its chunks. The output is collected.
class HttplibStream : public httplib::Stream {
 public:
  HttplibStream(const Request& request, net::IncomingBody& body)
      : head_("GET " + with_one_question_mark(request.target) + " HTTP/1.1\r\n\r\n"), body_(body) {}

  ssize_t read(char* target, std::size_t size) override {
    if (head_read_ < head_.size()) {
      const std::size_t count = head_.copy(target, size, head_read_);
      head_read_ += count;
      return static_cast<ssize_t>(count);
    }
    if (ahead_read_ == ahead_.size() && !is_over_ && !read_ahead()) return -1;
    const std::size_t count = ahead_.copy(target, size, ahead_read_);
    ahead_read_ += count;
    return static_cast<ssize_t>(count);
  }

  ssize_t write(const char* bytes, std::size_t size) override {
    written_.append(bytes, size);
    return static_cast<ssize_t>(size);
  }

  bool is_readable() const override { return true; }
  bool is_writable() const override { return true; }
  void get_remote_ip_and_port(std::string& /*ip*/, int& /*port*/) const override {}
  void get_local_ip_and_port(std::string& /*ip*/, int& /*port*/) const override {}
  // Never a descriptor: the library rejects descriptors too large for select().
  socket_t socket() const override { return 0; }

  std::string take_written() { return std::move(written_); }

  // The library has passed on bytes of a form's file.
  void passed_file_on() { beside_files_ = 0; }

 private:
  // Buffers the body: the library reads in pieces too small for system calls.
  bool read_ahead() {
    beside_files_ += ahead_.size();
    if (beside_files_ > limits::kMostBytesBesideFiles) return false;
    ahead_read_ = 0;
    ahead_.resize(kPieceBytes);
    const auto count = body_.read(ahead_);
    ahead_.resize(count.value_or(0));
    is_over_ = count == 0U;
    if (is_over_) ahead_ = kFormEnd;
    return count.has_value();
  }

  const std::string head_;
  std::size_t head_read_ = 0;
  std::string ahead_;  // buffered bytes of the body
  std::size_t ahead_read_ = 0;
  bool is_over_ = false;
  std::size_t beside_files_ = 0;  // bytes of the body since a file's
  net::IncomingBody& body_;
  std::string written_;
};

class HttplibBodyReader : public BodyReader {
 public:
  HttplibBodyReader(const httplib::ContentReader& reader, HttplibStream& stream,
                    net::IncomingBody& body)
      : reader_(reader), stream_(stream), body_(body) {}

  bool read(const TakePiece& take) override {
    std::string piece(kPieceBytes, '\0');
    while (true) {
      const auto count = body_.read(piece);
      if (!count || *count == 0) return count.has_value();
      if (!take(std::string_view(piece).substr(0, *count))) return false;
    }
  }

  bool read_form(const BeginField& begin, const TakePiece& take) override {
    return reader_(
        [&](const httplib::MultipartFormData& field) { return begin(field.name, field.filename); },
        [&](const char* bytes, std::size_t size) {
          stream_.passed_file_on();
          return take({bytes, size});
        });
  }

  bool is_whole() const override { return body_.is_whole(); }
  bool was_too_slow() const override { return body_.was_too_slow(); }
  bool was_malformed() const override { return body_.was_malformed(); }
  bool was_cut() const override { return body_.was_cut(); }

 private:
  const httplib::ContentReader& reader_;
  HttplibStream& stream_;
  net::IncomingBody& body_;
};

// The library's server for one request: its callbacks have no argument to distinguish requests.
class HttplibServer : public httplib::Server {
 public:
  HttplibServer(Request& request, HttplibStream& stream, net::IncomingBody& body,
                Response& response, const std::function<void()>& handle)
      : request_(request), stream_(stream), body_(body), response_(response), handle_(handle) {
    set_payload_max_length(
        std::numeric_limits<std::size_t>::max());  // handlers enforce their own limits
    set_pre_routing_handler([this](const httplib::Request& /*in*/, httplib::Response& out) {
      if (takes_body()) return HandlerResponse::Unhandled;
      handle_into(out);
      return HandlerResponse::Handled;
    });
    // The library lets only such handlers read bodies.
    if (takes_body()) {
      const auto read = [this](const httplib::Request& /*in*/, httplib::Response& out,
                               const httplib::ContentReader& reader) {
        HttplibBodyReader body_reader(reader, stream_, body_);
        request_.body = &body_reader;
        handle_into(out);
        request_.body = nullptr;
      };
      Post("/", read);
      Patch("/", read);
      Put("/", read);
    }
    set_error_handler([this](const httplib::Request& /*in*/, httplib::Response& out) {
      if (is_answered_) return;
      answer_problem(request_, response_,
                     {ErrorCode::kInvalidParameter, "the request is malformed"});
      write_into(out);
    });
  }

  void run() { process(*this, stream_); }

 private:
  // The protected process_request is the library's only entry point without a socket. Its arguments
  // changed between 0.11 (Debian 12) and 0.18 (Debian 13).
  template <class Self>
  static void process(Self& self, httplib::Stream& stream) {
    const std::function<void(httplib::Request&)> prepare = [&](httplib::Request& in) {
      self.exchange_heads(in);
    };
    bool is_closed = false;
    if constexpr (requires { self.process_request(stream, true, is_closed, prepare); }) {
      self.process_request(stream, true, is_closed, prepare);
    } else {
      self.process_request(stream, "", 0, "", 0, true, is_closed, prepare);
    }
  }

  bool takes_body() const {
    return request_.method == "POST" || request_.method == "PATCH" || request_.method == "PUT";
  }

  // Takes the decoded path and query from the library, and gives it the headers it needs: it would
  // answer Expect before the handler knows whether it wants the body, and it inflates bodies, reads
  // ranges and keeps connections in ways of its own.
  void exchange_heads(httplib::Request& in) {
    in_ = &in;
    request_.path = std::move(in.path);
    request_.query.assign(in.params.begin(), in.params.end());
    in.path = "/";
    if (takes_body()) in.method = request_.method;
    in.headers.clear();
    for (const auto& [name, value] : request_.headers) {
      if (net::equal_names(name, kAcceptEncoding)) in.headers.emplace(kAcceptEncoding, value);
    }
    // The library knows the type of a form in lower case only, with no parameter but the boundary.
    if (request_.is_form()) {
      in.headers.emplace("Content-Type",
                         "multipart/form-data; boundary=" +
                             header_parameter(request_.header("Content-Type"), "boundary"));
    }
  }

  void handle_into(httplib::Response& out) {
    is_answered_ = true;
    handle_();
    write_into(out);
  }

  void write_into(httplib::Response& out) {
    out.status = response_.status;
    out.set_header("Date", http_date_of(std::chrono::system_clock::now()));
    out.set_header("X-Content-Type-Options", "nosniff");
    out.set_header("Cross-Origin-Resource-Policy", "same-origin");
    for (const auto& [name, value] : response_.headers) out.set_header(name, value);
    if (response_.stream) {
      // The sender does not compress, so the library must not say so in the head.
      if (in_ != nullptr) in_->headers.erase(kAcceptEncoding);
      announce(*response_.stream, out);
    } else if (!response_.body.empty()) {
      out.set_content(std::move(response_.body), response_.media_type);
    }
  }

  // The library writes the head and requests the body. It gets none: the sender sends the body at
  // the receiver's pace.
  static void announce(const StreamedBody& body, httplib::Response& out) {
    const auto nothing = [](std::size_t, httplib::DataSink&) { return false; };
    switch (body.framing) {
      case Framing::kLength:
        return out.set_content_provider(
            body.length, body.media_type,
            [](std::size_t, std::size_t, httplib::DataSink&) { return false; });
      case Framing::kChunks:
        return out.set_chunked_content_provider(body.media_type, nothing);
      case Framing::kUntilConnectionEnds:
        return out.set_content_provider(body.media_type, nothing);
    }
  }

  Request& request_;
  HttplibStream& stream_;
  net::IncomingBody& body_;
  Response& response_;
  const std::function<void()>& handle_;
  httplib::Request* in_ = nullptr;  // the library's, while it handles the request
  bool is_answered_ = false;
};

}  // namespace

// The library answers HEAD as GET, so that both have the same headers; the body is left out here.
WrittenResponse run_through_httplib(Request& request, net::IncomingBody& body, Response& response,
                                    const std::function<void()>& handle) {
  constexpr std::string_view kHeadEnd = "\r\n\r\n";
  HttplibStream stream(request, body);
  HttplibServer(request, stream, body, response, handle).run();
  WrittenResponse written{.bytes = stream.take_written()};
  const std::size_t head_end = written.bytes.find(kHeadEnd);
  const bool has_head_only = request.method == "HEAD";
  if (has_head_only) response.stream.reset();
  if (head_end != std::string::npos) {
    if (has_head_only) written.bytes.resize(head_end + kHeadEnd.size());
    written.body_bytes = written.bytes.size() - head_end - kHeadEnd.size();
  }
  if (response.stream) written.body_bytes += response.stream->length;
  return written;
}

}  // namespace isomesh::http
