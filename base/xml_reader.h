// Incremental reader of untrusted XML documents.
#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string_view>

struct XML_ParserStruct;

namespace isomesh {

// The attributes of one element, valid only in its callback. Names are unique.
class XmlAttributes {
 public:
  // `pairs`: alternating names and values, up to a null.
  explicit XmlAttributes(const char* const* pairs) : pairs_(pairs) {}

  std::optional<std::string_view> find(std::string_view name) const;

  template <class Visit>
  void for_each(const Visit& visit) const {
    for (const char* const* pair = pairs_; *pair != nullptr; pair += 2) visit(pair[0], pair[1]);
  }

 private:
  const char* const* pairs_;
};

// Callbacks of a document. XmlReader::read rethrows their exceptions and stops.
class XmlHandler {
 public:
  virtual ~XmlHandler() = default;
  virtual void start_element(std::string_view name, const XmlAttributes& attributes) = 0;
  virtual void end_element(std::string_view /*name*/) {}
  // In UTF-8; one text may arrive in several parts.
  virtual void text(std::string_view /*part*/) {}
  // The encoding in the document's declaration; not called without one.
  virtual void encoding(std::string_view /*name*/) {}
};

// The document cannot be read. what() is a part of a sentence with the reason and the line.
struct XmlError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// Reads no other files, and takes little more memory than the longest tag. Entity declarations,
// which can expand without bounds, are an XmlError.
class XmlReader {
 public:
  explicit XmlReader(XmlHandler& handler);
  ~XmlReader();
  XmlReader(const XmlReader&) = delete;
  XmlReader& operator=(const XmlReader&) = delete;

  // Parses the next bytes; does nothing after stop(). Throws XmlError, and exceptions of the
  // handler.
  void read(std::string_view piece, bool is_last);

  // Called by a handler: ends the reading.
  void stop();
  bool is_stopped() const { return is_stopped_; }

  // The byte range, from the start of the document, of the event in its callback, otherwise of the
  // bytes read.
  std::uint64_t begin() const;
  std::uint64_t end() const;

 private:
  struct Callbacks;
  struct Free {
    void operator()(XML_ParserStruct* parser) const;
  };

  [[noreturn]] void throw_unreadable(std::string_view reason) const;

  XmlHandler& handler_;
  const std::unique_ptr<XML_ParserStruct, Free> parser_;
  std::exception_ptr failure_;
  bool is_stopped_ = false;
};

}  // namespace isomesh
