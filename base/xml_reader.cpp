#include "base/xml_reader.h"

#include <algorithm>
#include <new>
#include <string>

#include <expat.h>

namespace isomesh {

std::optional<std::string_view> XmlAttributes::find(std::string_view name) const {
  for (const char* const* pair = pairs_; *pair != nullptr; pair += 2) {
    if (pair[0] == name) return pair[1];
  }
  return std::nullopt;
}

// Exceptions cannot pass through the C library, so they are kept until parsing has stopped.
struct XmlReader::Callbacks {
  template <class Action>
  static void guard(void* self, const Action& action) {
    auto& reader = *static_cast<XmlReader*>(self);
    // A stopped parser still reports the end of an empty element.
    if (reader.failure_ || reader.is_stopped_) return;
    try {
      action(reader);
    } catch (...) {
      reader.failure_ = std::current_exception();
      ::XML_StopParser(reader.parser_.get(), XML_FALSE);
    }
  }

  static void XMLCALL start(void* self, const XML_Char* name, const XML_Char** attributes) {
    guard(self, [&](XmlReader& reader) {
      reader.handler_.start_element(name, XmlAttributes(attributes));
    });
  }
  static void XMLCALL end(void* self, const XML_Char* name) {
    guard(self, [&](XmlReader& reader) { reader.handler_.end_element(name); });
  }
  static void XMLCALL text(void* self, const XML_Char* part, int size) {
    guard(self, [&](XmlReader& reader) {
      reader.handler_.text({part, static_cast<std::size_t>(size)});
    });
  }
  static void XMLCALL declaration(void* self, const XML_Char*, const XML_Char* encoding, int) {
    if (encoding == nullptr) return;
    guard(self, [&](XmlReader& reader) { reader.handler_.encoding(encoding); });
  }
  static void XMLCALL entity(void* self, const XML_Char*, int, const XML_Char*, int,
                             const XML_Char*, const XML_Char*, const XML_Char*, const XML_Char*) {
    guard(self, [](XmlReader& reader) { reader.throw_unreadable("an entity is declared"); });
  }
};

void XmlReader::Free::operator()(XML_ParserStruct* parser) const { ::XML_ParserFree(parser); }

XmlReader::XmlReader(XmlHandler& handler)
    : handler_(handler), parser_(::XML_ParserCreate(nullptr)) {
  if (!parser_) throw std::bad_alloc();
  ::XML_SetUserData(parser_.get(), this);
  ::XML_SetElementHandler(parser_.get(), &Callbacks::start, &Callbacks::end);
  ::XML_SetCharacterDataHandler(parser_.get(), &Callbacks::text);
  ::XML_SetXmlDeclHandler(parser_.get(), &Callbacks::declaration);
  ::XML_SetEntityDeclHandler(parser_.get(), &Callbacks::entity);
}

XmlReader::~XmlReader() = default;

void XmlReader::read(std::string_view piece, bool is_last) {
  constexpr std::size_t kMostBytes = std::size_t{1} << 20;  // expat takes an int
  do {
    if (is_stopped_) return;
    const std::string_view next = piece.substr(0, kMostBytes);
    piece.remove_prefix(next.size());
    const auto status = ::XML_Parse(parser_.get(), next.data(), static_cast<int>(next.size()),
                                    is_last && piece.empty() ? XML_TRUE : XML_FALSE);
    if (failure_) std::rethrow_exception(failure_);
    if (status == XML_STATUS_OK || is_stopped_) continue;
    const char* reason = ::XML_ErrorString(::XML_GetErrorCode(parser_.get()));
    throw_unreadable(reason == nullptr ? "not well-formed" : reason);
  } while (!piece.empty());
}

void XmlReader::stop() {
  is_stopped_ = true;
  ::XML_StopParser(parser_.get(), XML_FALSE);
}

// Newer libexpat has these three with 64 bits under other names, and deprecates them.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"

std::uint64_t XmlReader::begin() const {
  return static_cast<std::uint64_t>(
      std::max(::XML_GetCurrentByteIndex(parser_.get()), XML_Index{0}));
}

std::uint64_t XmlReader::end() const {
  return begin() + static_cast<std::uint64_t>(::XML_GetCurrentByteCount(parser_.get()));
}

void XmlReader::throw_unreadable(std::string_view reason) const {
  throw XmlError(std::string(reason) + " in line " +
                 std::to_string(::XML_GetCurrentLineNumber(parser_.get())));
}

#pragma GCC diagnostic pop

}  // namespace isomesh
