// How much work a profile's layers put into their predictions.
#pragma once

namespace meshtide {

// Both efforts are one walk; they differ in contexts, geometry and the size of the mixer.
enum class Effort { standard, high }; // "standard" is effort default, which C++ has as a keyword

} // namespace meshtide
