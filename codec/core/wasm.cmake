# WebAssembly: decoders that import nothing, as small as they can be, and the core's tests as a program that Node runs.
#
# What the flags bring, in bytes of the compressed file: addresses are computed where they are used (no LSR), 3 %; loads
# stay where they are (no PRE), 1 %; only what becomes smaller is inlined where time does not matter, 4 %; numbers take as
# few bytes as they need (--compress-relocations), 1 %; structures are handed over in parts (experimental-mv), 2 %.
set(CMAKE_POSITION_INDEPENDENT_CODE OFF)
target_compile_options(rules INTERFACE -Oz -msimd128 -fno-exceptions -fno-slp-vectorize "SHELL:-mllvm -disable-lsr"
                       "SHELL:-mllvm -enable-load-pre=false" -mmultivalue
                       "SHELL:-Xclang -target-abi -Xclang experimental-mv")
set(COLD ${SOURCES})
list(FILTER COLD EXCLUDE REGEX "/(codec/classic_decoder|codec/effort_layers|diff/code_diff)\\.cpp$")
set_source_files_properties(${COLD} PROPERTIES COMPILE_OPTIONS "-mllvm;-inline-threshold=1")
target_link_options(rules INTERFACE -Oz) # which the library of C++ is built with, too

set(FUNCTIONS
  malloc free mt_last_failure
  mt_stream_parse mt_stream_free mt_stream_header
  mt_states_new mt_states_free mt_states_load
  mt_decoder_new mt_decoder_free mt_decoder_push mt_decoder_available mt_decoder_exact mt_decoder_changed
  mt_decoder_show)
list(TRANSFORM FUNCTIONS PREPEND --export= OUTPUT_VARIABLE EXPORTS)
set(NODE node ${CMAKE_CURRENT_SOURCE_DIR}/tests/run_wasm.mjs)

# Linked without any library: what the functions do not need is left out. The stack is in front of everything else, so
# that it traps where it ends. Nothing in the file depends on where or when it was made.
add_library(runtime OBJECT wasm/runtime.cpp)
target_link_libraries(runtime PRIVATE rules)
target_compile_options(runtime PRIVATE -fno-builtin-malloc)

# NAME.wasm and its objects, core-NAME: a decoder of what the definitions leave in it, and how large it may be.
function(add_decoder NAME LARGEST_BYTES)
  add_library(core-${NAME} OBJECT ${SOURCES})
  target_link_libraries(core-${NAME} PUBLIC rules)
  target_compile_definitions(core-${NAME} PUBLIC ${ARGN})
  set(FILE ${CMAKE_CURRENT_BINARY_DIR}/${NAME}.wasm)
  add_custom_command(
    OUTPUT ${FILE}
    COMMAND ${CMAKE_CXX_COMPILER} -m ziglang wasm-ld --no-entry --fatal-warnings --strip-all --compress-relocations
      --stack-first -z stack-size=1048576 ${EXPORTS} -o ${FILE} $<TARGET_OBJECTS:core-${NAME}> $<TARGET_OBJECTS:runtime>
    DEPENDS $<TARGET_OBJECTS:core-${NAME}> $<TARGET_OBJECTS:runtime>
    COMMAND_EXPAND_LISTS VERBATIM)
  add_custom_target(${NAME} ALL DEPENDS ${FILE})
  add_dependencies(${NAME} core-${NAME} runtime)
  add_test(NAME ${NAME}_wasm COMMAND ${NODE} decoder ${FILE} ${LARGEST_BYTES})
endfunction()
# What a browser loads first, and what it loads for a stream of effort high or profile classic.
add_decoder(meshtide 35300 MESHTIDE_DEFAULT_ONLY)
add_decoder(meshtide-full 49300)

add_executable(core_tests ${TESTS})
target_link_libraries(core_tests PRIVATE core-meshtide-full)
target_link_options(core_tests PRIVATE -Wl,--fatal-warnings -Wl,--export=mt_last_failure -Wl,--export=__stack_pointer
                    -Wl,--export-table)
set_target_properties(core_tests PROPERTIES SUFFIX .wasm)

add_test(NAME core_tests_wasm COMMAND ${NODE} tests $<TARGET_FILE:core_tests>)
