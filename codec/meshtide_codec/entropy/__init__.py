"""Entropy coding: a binary adaptive range coder, probability models, and integers made of binary decisions.

The coder (`range_coder_kernels`) and the models (`model_kernels`) are separate parts: a model says how probable a
one is, the coder spends the bits. Every kernel serves encoder and decoder alike: when the coder state says
"decoding", the value given is ignored and the value read is returned. So a packet's format is written down once.
"""
